"""What each effect and each kind of arithmetic costs."""
