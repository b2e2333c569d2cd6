"""The corrected model, and the gap as its FMU leaves it.

| module | holds |
|---|---|
| `corrected_model` | effects and calibration put in, its FMU driven, the gap computed |
| `reading_units` | the gain of a device moved before its effects |
| `gap`, `playable` | the gap at three stages, measured through the FMU |
| `driver` | the child process in which an FMU is driven |
"""
