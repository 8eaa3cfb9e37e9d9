"""Laws of normal force, one module each."""
