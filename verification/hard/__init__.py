from verification.hard import substrates, flow, contact
CASES = (*substrates.CASES, *flow.CASES, *contact.CASES)
