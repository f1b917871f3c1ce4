"""What every program needs: errors, progress, threads, memory, streams, the cache, whole files.

May import nothing of ours.
"""
