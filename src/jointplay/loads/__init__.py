"""What acts on a mechanism besides contact: drives and joint friction."""
