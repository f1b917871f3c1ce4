"""Dense refinement of inverse range on the sphere, from many pictures."""
