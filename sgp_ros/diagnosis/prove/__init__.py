"""The final model on data that it never saw: efforts, accelerations, roll-outs."""
