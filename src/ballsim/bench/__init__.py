"""The paper's Sections III to VI on its own, simplified model, with its figures."""
