"""Monte-Carlo studies: many runs, what survived, and how sure that is."""
