"""What `sgp campaign` promises, measured: wear found under warm-up, false alarms, lost workers."""
