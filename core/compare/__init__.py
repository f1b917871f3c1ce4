"""`edf compare`: every field on every pair, in one table and one page.

    pairs ──► register once ──► each field: lay, compose, figures, pictures ──► tables, page
"""
