from verification.hard import substrates, flow, contact, growth, runs
CASES = (*substrates.CASES, *flow.CASES, *contact.CASES, *growth.CASES, *runs.CASES)
