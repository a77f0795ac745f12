"""The nominal robot and a recording: signals, filters, the discrepancy as equations."""
