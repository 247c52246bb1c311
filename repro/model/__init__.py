"""The paper's model: flow, kinetics, substrates, growth, contact, mesh motion and traction, and the
state of the pore."""
