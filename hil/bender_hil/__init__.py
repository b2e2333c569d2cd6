"""The bench: supply, camera, tip tracking, guard, runner, and an emulated bench that is real down to the wire."""
