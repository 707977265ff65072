"""The worker process: reads messages on stdin, calls an environment, writes messages on stdout."""
