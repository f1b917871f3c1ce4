"""Every field on every pair, in one table and page.

May import the rooms before it but the rivals, and the pipeline.
"""
