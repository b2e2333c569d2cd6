"""The search for what is missing from a model: one loop, one archive, one score.

search      the loop: grow, improve, make the case against every effect
moves       what may change in a hypothesis, each change a small function
explore     fits what the moves propose: scanned, roughly, to the end
archive     every fit once, with what it predicts of blocks that its fit did not see
score       how far one hypothesis predicts better than another
rules       the constants that decide
grades      how sure each effect is
verdict     the contract's word for all of it
"""
