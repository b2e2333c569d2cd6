"""Every check at hand on any FMU: archive, schema, rules of the standard that schemas cannot state, a trial run."""
