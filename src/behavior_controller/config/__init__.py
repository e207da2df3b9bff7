"""What is configured by files: settings, phrases, recovery policy and knowledge."""
