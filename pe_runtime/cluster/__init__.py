"""Frames of a Shot over Dask workers: this machine's cores, or those of many machines.

The client encodes the start and rolls it out once. Runs of frames go to the workers as plain data,
and come back as the bytes of their files, which the client writes: workers share no disk with it.

    client   spreading -> connection     hands out runs, collects files, retries
                |  parcels, model_copies
    worker   tasks -> drawing            loads the model once, draws, encodes

This file imports nothing, so that a Dask scheduler, which looks at the tasks, needs no torch.
"""
