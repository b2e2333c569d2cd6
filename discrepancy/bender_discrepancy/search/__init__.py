"""The search for missing effects: beam, single steps, revision, evidence, verdict."""
