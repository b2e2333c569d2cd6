"""The camera: newest frame, honest times, counted losses.

| module | holds |
|---|---|
| `reader` | the newest frame of a source |
| `settings` | what is asked of a camera |
| `source` | opening a source of frames with OpenCV: a device by number, a file, or a stream's address |
"""
