"""Who solves in batches beside the process that asks: processes of this machine, or a cluster."""
