"""One file per effect, under the name that reports and pages give it; an effect never imports another one.

The folder grows by a file for each effect and holds nothing else. Which effects act where, from the supply to the
sensor, is listed by `bender effects` and in `docs/effects/index.md`; `effects.catalogue` collects the files,
`effects.effect` says what each of them states, and the physics stands in the block of the same name in
`bender_plant.blocks`.
"""
