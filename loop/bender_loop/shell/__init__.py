"""What commands share: progress, tables, whole files, complaints about files."""
