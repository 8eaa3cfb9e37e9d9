"""Laws of friction, one module each: functions of the speed, and with bristles."""
