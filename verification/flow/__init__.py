"""Flow (2.1, 3.2): closed forms, manufactured flow, Taylor-Hood elements, and what holds of any viscous flow."""
