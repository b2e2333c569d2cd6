"""What an identification tells: findings, tables, loops, the page."""
