"""An honest, slow simulator that shares nothing with `delaytools`, and the reference runs made with it."""
