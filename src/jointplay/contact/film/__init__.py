"""Laws of lubricant films, one module each; `law` says what a film law is."""
