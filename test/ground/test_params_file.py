"""Parameter files: rcl itself says what a file gives to a node; names and remappings."""

import pytest

from deck_motion_ros.config import Parameter
from deck_motion_ros.names import absolute, remappings
from deck_motion_ros.params_file import read_params_file

FILES = {
    'a node': 'predictor:\n  ros__parameters: {horizon: 1.0, method: shaping}\n',
    'with slash': '/predictor:\n  ros__parameters: {horizon: 1.0}\n',
    'every node': '/**:\n  ros__parameters: {horizon: 1.0, lever_arm: [-35.0, 0.0, 6.0]}\n',
    'general, then particular': '/**:\n  ros__parameters: {horizon: 2.0, output_rate: 5.0}\n'
                                '/predictor:\n  ros__parameters: {horizon: 1.0}\n',
    'particular, then general': '/predictor:\n  ros__parameters: {horizon: 1.0}\n'
                                '/**:\n  ros__parameters: {horizon: 2.0}\n',
    'a namespace': '/palmer/predictor:\n  ros__parameters: {horizon: 1.0}\n',
    'a namespace, nested': 'palmer:\n  predictor:\n    ros__parameters: {horizon: 1.0}\n',
    'one namespace, any': '/*/predictor:\n  ros__parameters: {horizon: 1.0}\n',
    'any name': '/*:\n  ros__parameters: {horizon: 1.0}\n',
    'any namespaces': '/**/predictor:\n  ros__parameters: {horizon: 1.0}\n',
    'all of a namespace': '/palmer/**:\n  ros__parameters: {horizon: 1.0}\n',
    'any below a namespace': '/fleet/**/predictor:\n  ros__parameters: {horizon: 1.0}\n',
    'another node': 'recorder:\n  ros__parameters: {horizon: 1.0}\n',
    'the name begins alike': 'predictor2:\n  ros__parameters: {horizon: 1.0}\n',
    'nested names': '/**:\n  ros__parameters:\n    qos: {depth: {a: 3}}\n    horizon: 2.0\n',
    'kinds': '/**:\n  ros__parameters: {a: 1, b: 1.5, c: true, d: word, e: "3", f: [1, 2], '
             'g: ["x", "y"], h: 1e-3, i: [0.5, 1.0], j: -4, k: "true"}\n',
    'wholes for decimals': '/**:\n  ros__parameters: {horizon: 3, lever_arm: [-35, 0, 6]}\n',
}


def by_rcl(path, namespace, domain_id):
    """Return what a real node gets from the file."""
    rclpy = pytest.importorskip('rclpy', reason='no ROS 2 here')
    context = rclpy.Context()
    rclpy.init(args=['--ros-args', '--params-file', str(path)], context=context,
               domain_id=domain_id)
    try:
        node = rclpy.create_node('predictor', namespace=namespace, context=context,
                                 enable_rosout=False, start_parameter_services=False)
        given = node._parameter_overrides
        node.destroy_node()
    finally:
        context.try_shutdown()
    return {name: list(item.value) if hasattr(item.value, 'tolist') else item.value
            for name, item in given.items()}


@pytest.mark.parametrize('text', FILES.values(), ids=FILES)
def test_a_file_gives_what_rcl_gives(tmp_path, domain_id, text):
    path = tmp_path / 'params.yaml'
    path.write_text(text)
    for namespace in ('/', '/palmer', '/fleet/palmer'):
        ours = read_params_file(path, 'predictor', namespace)
        theirs = by_rcl(path, namespace, domain_id)
        assert ours == theirs, namespace
        assert {name: type(value) for name, value in ours.items()} == {
            name: type(value) for name, value in theirs.items()}


def test_yes_is_a_word_and_the_error_says_so(tmp_path):
    """Rcl reads YAML 1.1, where it is true; here true must be written so."""
    path = tmp_path / 'params.yaml'
    path.write_text('/**:\n  ros__parameters: {on: yes}\n')
    value = read_params_file(path, 'player')['on']
    with pytest.raises(ValueError, match="'on' must be true or false, not 'yes'"):
        Parameter('on', True, 'a switch').check(value)


def test_an_empty_file_gives_nothing(tmp_path, domain_id):
    path = tmp_path / 'empty.yaml'
    path.write_text('# nothing yet\n')
    assert read_params_file(path, 'predictor') == by_rcl(path, '/', domain_id) == {}


@pytest.mark.parametrize('content', [
    b'a: [1, 2', b'- 1\n- 2\n', b'word', b'\xff\xfe\x00', b'predictor:\n  ros__parameters: 3\n',
    b'a: 1\na: 2\n', b'\x00'])
def test_what_is_no_parameter_file_is_named(tmp_path, content):
    path = tmp_path / 'bad.yaml'
    path.write_bytes(content)
    with pytest.raises(ValueError) as error:
        read_params_file(path, 'predictor')
    assert str(path) in str(error.value) and '\n' not in str(error.value)


def test_a_missing_file_is_an_os_error(tmp_path):
    with pytest.raises(OSError):
        read_params_file(tmp_path / 'none.yaml', 'predictor')


@pytest.mark.parametrize('name, namespace, full', [
    ('ship/imu', '/', '/ship/imu'), ('ship/imu', 'palmer', '/palmer/ship/imu'),
    ('ship/imu', '/palmer/', '/palmer/ship/imu'), ('/diagnostics', 'palmer', '/diagnostics'),
    ('ship/imu', '', '/ship/imu'), ('x', '/a/b', '/a/b/x')])
def test_absolute_names(name, namespace, full):
    assert absolute(name, namespace) == full


def test_remappings_are_resolved_in_the_namespace():
    assert remappings(['ship/imu:=mru/imu', '/a:=b'], 'palmer') == {
        '/palmer/ship/imu': '/palmer/mru/imu', '/a': '/palmer/b'}


@pytest.mark.parametrize('rule', ['', 'a', 'a:=', ':=b', 'a=b', 'a:b'])
def test_what_is_no_remapping_is_named(rule):
    with pytest.raises(ValueError, match='remapping'):
        remappings([rule])
