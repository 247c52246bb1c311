"""The paper: geometry and state of a pore, flow, kinetics, substrates, growth, contact, mesh motion, traction."""
