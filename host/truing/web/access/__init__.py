"""Access control: allowed hosts, token, and the single driver."""
