"""Every field on every pair, in one table and page.

May import every room before it and the pipeline.
"""
