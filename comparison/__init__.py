"""Our model against MuJoCo's, number by number: `make plant` writes docs/plant.md."""
