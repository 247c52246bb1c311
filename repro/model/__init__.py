"""The paper's model: flow, kinetics, substrates, growth, contact, mesh motion, traction, and the
state of the pore that they work on."""
