"""The experiment as assumed: geometry, material, load, support, tool, sensor and registrations.

Bodies are blocks, or closed surfaces that are checked and filled with tetrahedra:

    shape = load_shape(Path("organ.stl"), scale=1e-3, fixed=Plane(tolerance=5e-4))
    setup = Setup(geometry=shape, tool=Tool(radius=5e-3))
    frames = replay(setup, centres, TetSpec.along(centres, setup.tool.radius, spacing=1.2e-3))
"""
