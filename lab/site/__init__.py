"""The documentation as a site: examples that run, and pages that are made of the code itself."""
