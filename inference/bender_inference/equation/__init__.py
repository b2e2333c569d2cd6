"""A sparse equation for a residual that no effect of the catalogue explains.

| module | holds |
|---|---|
| `lead` | the equation, or why there is none |
| `lead_terms` | candidate terms |
| `lead_track` | the residual of every record, with the integrals of the terms |
| `lead_supports`, `lead_fit`, `lead_choice` | sets of terms, their fit, the choice among them |
| `joined` | the equation in the corrected model, where it predicts better |
"""
