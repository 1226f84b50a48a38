"""What examines the product and is not installed: reference, oracles, cases, studies, the paper, drills, benchmarks."""
