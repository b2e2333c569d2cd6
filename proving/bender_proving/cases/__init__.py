"""Cases: what is hidden in which bench, drawn, selected and written to files.

| module | holds |
|---|---|
| `case` | a case: one bench with something hidden in it, or nothing, and the way in which it is recorded |
| `draw` | cases drawn so that what is hidden shows |
| `effects` | the table of everything that can be hidden in a bench |
| `hidden` | what may be hidden in a bench: effects, their forms, and one drawn instance of them |
| `lookalikes` | what else, in its simplest form, comes as near to a moved form as its own equation does |
| `nominal` | the bench without anything hidden: equation (30) of the paper, then the first bending mode |
| `outside` | effects that no entry of the catalogue describes |
| `residual` | what a model leaves of a reading once gain and offset are corrected |
| `rivals` | how well another effect, in its simplest form, mimics a reading |
| `selections` | the catalogue of cases: what a method of diagnosis is judged on |
| `weak` | confusable effects under an excitation that cannot distinguish them |
| `witnessed` | benches whose weak records leave effects confused, with instruments that can distinguish them |
"""
