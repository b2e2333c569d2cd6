"""What the optional channels of a record testify: the supply's read-back voltage and current, and the temperature.

| module | holds |
|---|---|
| `testimony` | what the channels of all records leave of each effect, what they show, and the sentences of the report |
| `missing_columns` | columns that the records lack and that could distinguish what they leave open |
| `terminals` | which effect of the supply a voltage shows that was read back, and what it leaves of the others |
| `read_back` | the voltage at the supply's terminals or at the electrodes, held against what its effects leave there |
| `ammeter` | how fast a supply slews whose current stays at its limit |
| `thermometer` | the course of the temperature, and how far the tip may have moved with it |
"""
