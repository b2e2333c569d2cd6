"""What a search found, made into numbers, notes, sentences, the corrected model, the gap and `diagnosis.json`."""
