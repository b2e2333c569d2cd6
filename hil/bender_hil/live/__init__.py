"""The page on which a run is watched and stopped.

The runner publishes the newest frame on a board; everything else on the page is read from the journals of the run. Two
processes of their own serve the page and the STOP button. A browser talks to the button's process directly, and that
one to the guard: the page's server, the runner and the loop have no part in it.

| module | holds |
|---|---|
| `command` | the arguments of `bender live` |
| `session` | both processes, started beside a run, and what the runner tells them |
| `frame_board` | the newest frame, for whoever shows it |
| `run_view` | what a page shows of a run, read from its journals while they grow |
| `output_view` | what it shows of the output: on, falling, off, or not known |
| `watch_view` | what it shows of a watch beside the run |
| `token_gate` | lets nobody in who does not know the token |
| `page` | the page: picture, charts, state, STOP |
| `page_server` | the page's process |
| `stop_button` | the button's process: plain HTTP on one side, the guard's ear on the other |
"""
