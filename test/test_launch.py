"""The launch files name executables and parameters that are there (needs a ROS installation)."""

from pathlib import Path
import runpy

from isotruss_ros.nodes import grasp_analysis, parameters, simulator
import pytest

launch = pytest.importorskip(
    'launch', reason='launch comes with a ROS 2 installation, there are no wheels of it'
)
pytest.importorskip('launch_ros', reason='launch_ros comes with a ROS 2 installation')

FOLDER = Path(__file__).parents[1] / 'launch'


@pytest.mark.parametrize('path', sorted(FOLDER.glob('*.launch.py')), ids=lambda path: path.name)
def test_launch_file_describes_nodes_with_known_parameters(path):
    description = runpy.run_path(str(path))['generate_launch_description']()
    arguments = {
        entity.name
        for entity in description.entities
        if isinstance(entity, launch.actions.DeclareLaunchArgument)
    }
    known = {
        spec.name
        for module in (parameters, simulator, grasp_analysis)
        for spec in vars(module).values()
        if isinstance(spec, parameters.Spec)
    } | {'use_sim_time'}
    assert arguments
    assert arguments <= known
