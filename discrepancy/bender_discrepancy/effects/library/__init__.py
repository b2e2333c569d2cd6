"""One file per effect; an effect never imports another one."""
