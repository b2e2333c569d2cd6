"""The command line: it reads arguments, calls the rooms below and turns their failures into exit statuses."""
