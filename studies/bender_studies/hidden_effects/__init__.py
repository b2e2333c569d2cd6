"""The judge of `bender diagnose`: benches with something hidden are diagnosed, and the answers held to the truth.

What is judged runs in processes of its own that are given records and nothing else; the truth stays with the judge.

| module | holds |
|---|---|
| `exposed_record` | a record of a hidden bench whose readings are means over an exposure |
| `constants`, `constants_benchmark` | verdicts with each deciding constant smaller and larger; the command for it |
| `session` | cases drawn, diagnosed in workers, judged as the answers come |
| `probabilities` | how well probabilities are kept, and the weights that judged effects teach |
| `suspected` | FMUs whose parameter is off, whose model lacks an effect, or both: drawn, diagnosed, judged |
| `witnessed` | benches whose effects are confused without the instruments beside the sensor, diagnosed with them |
| `trial` | one diagnosis, in a process that knows nothing of what is hidden |
| `judging` | an answer held to the truth |
| `intervals` | stated intervals of numbers with one true value, held to it |
| `figures`, `outputs` | shares of right answers, and their tables |
"""
