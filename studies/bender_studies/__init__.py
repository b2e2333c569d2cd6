"""What measures the project itself: reproduction of the paper, demonstration, benchmarks.

| module | holds |
|---|---|
| `bench_trials/` | the bench against its emulator: cadence, reaction times, all commands |
| `benchmarks/` | the benchmarks behind `bender benchmark`, one command each |
| `control/` | what a controller that uses the diagnosed model is worth on hidden benches |
| `demonstration/` | what `bender demo` does |
| `figures_page` | tables of a benchmark as a page of the documentation |
| `device_fuzz/` | devices drawn at random through a first model and a diagnosis |
| `fleet/` | what a fleet costs, and whether it names what its example hides |
| `gallery/` | what `bender gallery` does |
| `hidden_effects/` | the judge of `bender diagnose` |
| `investigations/` | investigations of benches that hide something, in virtual time |
| `reproduction/` | what `bender reproduce` does |
| `runner` | what benchmarks share: checks, work in processes, an interrupt that keeps what is done |
| `tuning/` | what the searches are worth, and what an evaluation costs |
| `vision/` | how well the tip is found |
| `watching/` | how soon `bender watch` says what, and how many rows it takes |
"""
