"""The model beside the running device: alarms that say what changed, since when and how large."""
