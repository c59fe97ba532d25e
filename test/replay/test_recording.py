"""Bags: written as rosbag2 does, read in order, repaired after any accident."""

from collections import Counter
import os
import resource
import shutil

from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import Reader, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import get_types_from_msg, get_typestore, Stores
from ruamel.yaml import YAML

from deck_motion_ros.recording import (
    BackgroundWriter,
    BagError,
    BagReader,
    BagTypes,
    BagWriter,
    encode,
    fitting_offer,
    fitting_request,
    PlayerConfig,
    recover,
    schedule,
    SequenceGaps,
    TopicChoice,
)
from deck_motion_ros.recording.metadata import to_yaml

STRING = 'std_msgs/msg/String'
IMU = 'sensor_msgs/msg/Imu'
SECOND = 1_000_000_000
FOREVER = QosTime(9223372036, 854775807)
TYPES = BagTypes()
FOREIGN = """rosbag2_bagfile_information:
  version: 4
  storage_identifier: sqlite3
  relative_file_paths: [x.db3]
  duration: {nanoseconds: 1}
  starting_time: {nanoseconds_since_epoch: 1}
  message_count: 1
  topics_with_message_count: []
  compression_format: ''
  compression_mode: ''
"""


def qos(reliability='RELIABLE', durability='VOLATILE', depth=0):
    return Qos(QosHistory.UNKNOWN, depth, QosReliability[reliability], QosDurability[durability],
               FOREVER, FOREVER, QosLiveliness.AUTOMATIC, FOREVER, False)


def text(data):
    return encode(STRING, TYPES[STRING](data=data))


def imu(stamp, rate):
    vector = TYPES['geometry_msgs/msg/Vector3']
    covariance = TYPES.floats(k + 0.5 for k in range(9))
    return TYPES[IMU](
        header=TYPES['std_msgs/msg/Header'](
            stamp=TYPES['builtin_interfaces/msg/Time'](sec=stamp // SECOND,
                                                       nanosec=stamp % SECOND),
            frame_id='ship_base_link'),
        orientation=TYPES['geometry_msgs/msg/Quaternion'](x=0.1, y=-0.2, z=0.3, w=0.9),
        orientation_covariance=covariance,
        angular_velocity=vector(x=rate, y=0.0, z=-rate),
        angular_velocity_covariance=covariance,
        linear_acceleration=vector(x=0.0, y=0.0, z=9.80665),
        linear_acceleration_covariance=covariance)


def write_texts(folder, times, *, flush_every=0, **options):
    """Write one text message per time, its number as the text, and return their bytes."""
    contents = []
    with BagWriter(folder, **options) as bag:
        bag.add_topic('/a', STRING)
        for k, time in enumerate(times):
            contents.append(text(str(k)))
            bag.write('/a', time, contents[-1])
            if flush_every and k % flush_every == 0:
                bag.flush()
    return contents


def description(folder):
    about = YAML(typ='safe').load((folder / 'metadata.yaml').read_text())
    return about['rosbag2_bagfile_information']


# what others read


@pytest.mark.parametrize('compression', ['none', 'zstd', 'lz4'])
def test_rosbags_decodes_the_values_that_were_written(tmp_path, compression):
    folder = tmp_path / 'bag'
    stamps = [k * 10_000_000 for k in range(300)]
    with BagWriter(folder, compression=compression) as bag:
        bag.add_topic('/ship/imu', IMU)
        for stamp in stamps:
            bag.write('/ship/imu', stamp + 7, encode(IMU, imu(stamp, stamp * 1e-9)))
    with AnyReader([folder]) as reader:
        seen = [(time, reader.deserialize(data, connection.msgtype))
                for connection, time, data in reader.messages()]
    assert [time for time, _ in seen] == [stamp + 7 for stamp in stamps]
    for stamp, (_, message) in zip(stamps, seen, strict=True):
        assert message.header.stamp.sec * SECOND + message.header.stamp.nanosec == stamp
        assert message.header.frame_id == 'ship_base_link'
        assert message.angular_velocity.z == -stamp * 1e-9
        assert np.array_equal(message.orientation_covariance, np.arange(9) + 0.5)


def test_a_file_is_laid_out_as_by_the_real_tool(tmp_path):
    folder = tmp_path / 'voyage'
    offers = [qos(), qos('BEST_EFFORT', 'TRANSIENT_LOCAL', 5)]
    with BagWriter(folder) as bag:
        bag.add_topic('/ship/imu', IMU, qos=offers)
        bag.write('/ship/imu', 5, encode(IMU, imu(5, 0.0)), publish_time=3)
    assert sorted(os.listdir(folder)) == ['metadata.yaml', 'voyage_0.mcap']
    with (folder / 'voyage_0.mcap').open('rb') as file:
        reader = make_reader(file)
        assert reader.get_header().profile == 'ros2'
        (schema, channel, message), = reader.iter_messages()
        notes = list(reader.iter_metadata())
    assert (schema.name, schema.encoding) == (IMU, 'ros2msg')
    definitions = schema.data.decode().split('=' * 80 + '\n')
    assert [part.split('\n')[0] for part in definitions[1:]] == [
        f'MSG: {name}' for name in ('std_msgs/Header', 'builtin_interfaces/Time',
                                    'geometry_msgs/Quaternion', 'geometry_msgs/Vector3')]
    assert channel.message_encoding == 'cdr'
    assert (message.log_time, message.publish_time) == (5, 3)
    # the hash that ROS 2 Jazzy itself gives the type
    assert channel.metadata['topic_type_hash'] == (
        'RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b')
    offered = YAML(typ='safe').load(channel.metadata['offered_qos_profiles'])
    assert [list(item) for item in offered] == 2 * [[
        'history', 'depth', 'reliability', 'durability', 'deadline', 'lifespan', 'liveliness',
        'liveliness_lease_duration', 'avoid_ros_namespace_conventions']]
    assert offered[1]['reliability'] == 'best_effort'
    assert offered[1]['durability'] == 'transient_local'
    assert offered[1]['deadline'] == {'sec': 9223372036, 'nsec': 854775807}
    assert {note.name for note in notes} == {'rosbag2'}
    last = YAML(typ='safe').load(notes[-1].metadata['serialized_metadata'])
    assert last == description(folder)


def test_metadata_has_the_fields_of_version_9_in_their_order(tmp_path):
    folder = tmp_path / 'bag'
    with BagWriter(folder, max_duration=2.0) as bag:
        bag.add_topic('/a', STRING, qos=[qos()])
        bag.add_topic('/silent', STRING)
        for second in range(5):
            bag.write('/a', (100 + second) * SECOND, text('x'))
    about = description(folder)
    assert list(about) == [
        'version', 'storage_identifier', 'duration', 'starting_time', 'message_count',
        'topics_with_message_count', 'compression_format', 'compression_mode',
        'relative_file_paths', 'files', 'custom_data', 'ros_distro']
    assert about['version'] == 9 and about['ros_distro'] == 'jazzy'
    assert about['storage_identifier'] == 'mcap' and about['compression_format'] == ''
    assert about['duration'] == {'nanoseconds': 4 * SECOND}
    assert about['starting_time'] == {'nanoseconds_since_epoch': 100 * SECOND}
    assert about['custom_data'] is None
    assert {item['topic_metadata']['name']: item['message_count']
            for item in about['topics_with_message_count']} == {'/a': 5, '/silent': 0}
    assert about['relative_file_paths'] == ['bag_0.mcap', 'bag_1.mcap', 'bag_2.mcap']
    assert [(item['path'], item['starting_time']['nanoseconds_since_epoch'] // SECOND,
             item['duration']['nanoseconds'] // SECOND, item['message_count'])
            for item in about['files']] == [
        ('bag_0.mcap', 100, 1, 2), ('bag_1.mcap', 102, 1, 2), ('bag_2.mcap', 104, 0, 1)]
    with Reader(folder) as reader:
        assert (reader.message_count, reader.duration - 1, reader.ros_distro) == (
            5, 4 * SECOND, 'jazzy')
        assert len(list(reader.messages())) == 5
        assert reader.topics['/a'].connections[0].ext.offered_qos_profiles == [qos()]


SCALARS = st.none() | st.booleans() | st.integers() | st.text(
    st.characters(codec='utf-8', min_codepoint=32))


@settings(max_examples=50)
@given(st.recursive(
    SCALARS, lambda inside: st.lists(inside, max_size=3)
    | st.dictionaries(st.from_regex('[a-z]{1,5}x', fullmatch=True), inside, max_size=3),
    max_leaves=5))
def test_yaml_is_read_back_as_it_was(value):
    assert YAML(typ='safe', pure=True).load(to_yaml(value)) == value


# splitting, size, types


def test_files_are_split_by_size_and_lose_nothing(tmp_path):
    contents = write_texts(tmp_path / 'bag', range(20_000), max_size=100_000)
    sizes = [path.stat().st_size for path in (tmp_path / 'bag').glob('*.mcap')]
    assert len(sizes) > 10
    assert max(sizes) < 125_000 and sorted(sizes)[1] > 100_000
    assert [data for *_, data in BagReader(tmp_path / 'bag').messages()] == contents


def test_compression_makes_a_bag_smaller(tmp_path):
    for compression in ('none', 'zstd', 'lz4'):
        write_texts(tmp_path / compression, range(5000), compression=compression)
    size = {path.name: sum(file.stat().st_size for file in path.glob('*.mcap'))
            for path in tmp_path.iterdir()}
    assert size['zstd'] < 0.5 * size['none'] and size['lz4'] < 0.7 * size['none']


def test_a_type_of_an_installed_package_is_stored_and_decoded(tmp_path, monkeypatch):
    msg = tmp_path / 'share/deck_msgs/msg'
    msg.mkdir(parents=True)
    (msg / 'Net.msg').write_text('# a net\nstd_msgs/Header header\nKnot[] knots # all of them\n')
    (msg / 'Knot.msg').write_text('uint8 LOOSE=0\nfloat64[3] position\nstring<=8 name\n')
    header = 'builtin_interfaces/Time stamp\nstring frame_id\n'
    (tmp_path / 'share/std_msgs/msg').mkdir(parents=True)
    (tmp_path / 'share/std_msgs/msg/Header.msg').write_text(header)
    (tmp_path / 'share/builtin_interfaces/msg').mkdir(parents=True)
    (tmp_path / 'share/builtin_interfaces/msg/Time.msg').write_text('int32 sec\nuint32 nanosec\n')
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere{os.pathsep}{tmp_path}')
    store = get_typestore(Stores.ROS2_JAZZY)
    for name in ('Net', 'Knot'):
        store.register(get_types_from_msg((msg / f'{name}.msg').read_text(),
                                          f'deck_msgs/msg/{name}'))
    knot = store.types['deck_msgs/msg/Knot'](position=np.array([1.0, 2.0, 3.0]), name='bowline')
    net = store.types['deck_msgs/msg/Net'](header=imu(5, 0.0).header, knots=[knot, knot])
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic('/net', 'deck_msgs/msg/Net')
        bag.write('/net', 1, bytes(store.serialize_cdr(net, 'deck_msgs/msg/Net')))
    monkeypatch.delenv('AMENT_PREFIX_PATH')
    reader = BagReader(tmp_path / 'bag')
    (topic, _, data), = reader.messages()
    seen = reader.decode(topic, data)
    assert seen.header.frame_id == 'ship_base_link'
    assert [knot.name for knot in seen.knots] == ['bowline', 'bowline']
    assert seen.knots[1].position[2] == 3.0
    with AnyReader([tmp_path / 'bag']) as others:
        connection, _, data = next(others.messages())
        assert others.deserialize(data, connection.msgtype).knots[0].name == 'bowline'


def test_a_message_of_unknown_type_is_kept_but_not_decoded(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic('/secret', 'secret_msgs/msg/Secret')
        bag.write('/secret', 1, b'\x00\x01\x00\x00abcd')
    reader = BagReader(tmp_path / 'bag')
    (topic, _, data), = reader.messages()
    assert data == b'\x00\x01\x00\x00abcd'
    with pytest.raises(BagError, match='type of /secret, secret_msgs/msg/Secret, is not known'):
        reader.decode(topic, data)
    with Reader(tmp_path / 'bag') as others:
        assert next(others.messages())[2] == data


# reading


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.integers(0, 50), st.sampled_from('abc'), st.booleans()), min_size=1),
       st.integers(0, 50))
def test_messages_come_in_the_order_of_time_then_of_writing(tmp_path, plan, since):
    folder = tmp_path / 'bag'
    shutil.rmtree(folder, ignore_errors=True)
    with BagWriter(folder, max_duration=20e-9) as bag:
        for name in 'abc':
            bag.add_topic(f'/{name}', STRING)
        for k, (time, name, flush) in enumerate(plan):
            bag.write(f'/{name}', time, text(str(k)))
            if flush:
                bag.flush()
    reader = BagReader(folder)
    expected = sorted(((f'/{name}', time, text(str(k)))
                       for k, (time, name, _) in enumerate(plan)), key=lambda item: item[1])
    assert list(reader.messages()) == expected
    assert reader.counts == Counter(name for name, _, _ in expected)
    assert (reader.start, reader.end) == (expected[0][1], expected[-1][1])
    assert list(reader.messages(['/a', '/none'], since)) == [
        item for item in expected if item[0] == '/a' and item[1] >= since]


def test_a_file_without_index_is_read_too(tmp_path):
    with (tmp_path / 'plain.mcap').open('wb') as file:
        writer = Writer(file, use_chunking=False)
        writer.start('ros2', 'another recorder')
        schema = writer.register_schema(STRING, 'ros2msg', b'string data\n')
        channel = writer.register_channel('/a', 'cdr', schema)
        for k, time in enumerate([30, 10, 20]):
            writer.add_message(channel, time, text(str(k)), time)
        writer.finish()
    reader = BagReader(tmp_path / 'plain.mcap')
    seen = [(time, reader.decode(topic, data).data) for topic, time, data in reader.messages()]
    assert seen == [(10, '1'), (20, '2'), (30, '0')]


@pytest.mark.parametrize('storage', [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_bags_of_others_are_read(tmp_path, storage):
    store = get_typestore(Stores.ROS2_HUMBLE)
    with RosbagsWriter(tmp_path / 'bag', version=8, storage_plugin=storage) as writer:
        connection = writer.add_connection('/a', STRING, typestore=store)
        for k in range(3):
            writer.write(connection, k, bytes(text(str(k))))
    reader = BagReader(tmp_path / 'bag')
    assert reader.topics == {'/a': STRING} and reader.counts == {'/a': 3}
    assert [reader.decode(topic, data).data for topic, _, data in reader.messages()] == list('012')


def test_a_definition_that_differs_from_ours_is_the_one_that_counts(tmp_path):
    range_type = 'sensor_msgs/msg/Range'
    humble = get_typestore(Stores.ROS2_HUMBLE)  # its Range has no variance
    with RosbagsWriter(tmp_path / 'bag', version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection('/uwb', range_type, typestore=humble)
        message = humble.types[range_type](
            header=imu(1, 0.0).header, radiation_type=1, field_of_view=0.0, min_range=0.0,
            max_range=50.0, range=12.5)
        writer.write(connection, 1, bytes(humble.serialize_cdr(message, range_type)))
    reader = BagReader(tmp_path / 'bag')
    (topic, _, data), = reader.messages()
    seen = reader.decode(topic, data)
    assert seen.range == 12.5 and not hasattr(seen, 'variance')


@pytest.mark.parametrize('make, words', [
    (lambda path: None, 'does not exist'),
    (lambda path: path.mkdir(), 'holds no bag'),
    (lambda path: path.write_text('t_s,roll_deg\n'), 'not a bag'),
    (lambda path: (path.mkdir(), (path / 'x_0.mcap').write_text('$PSXN,23,1.0')),
     'x_0.mcap: not an MCAP file'),
    (lambda path: (path.mkdir(), (path / 'x_0.mcap').touch()), 'x_0.mcap: is empty'),
    (lambda path: (path.mkdir(), (path / 'metadata.yaml').write_text('- not\n- a: bag')),
     'metadata.yaml: damaged'),
    (lambda path: write_texts(path, []), 'holds no message'),
    (lambda path: (write_texts(path, [1]), (path / 'bag_0.mcap').unlink()),
     'bag_0.mcap: cannot be read: No such file'),
    (lambda path: (path.mkdir(), (path / 'x.db3').touch()), 'metadata.yaml is missing'),
    (lambda path: (path.mkdir(), (path / 'x.db3').write_text('no database ' * 99),
                   (path / 'metadata.yaml').write_text(FOREIGN)), 'cannot be read'),
])
def test_what_is_no_bag_is_named(tmp_path, make, words):
    make(tmp_path / 'bag')
    with pytest.raises(BagError, match=words) as caught:
        BagReader(tmp_path / 'bag')
    assert str(tmp_path / 'bag') in str(caught.value) and '\n' not in str(caught.value)


def test_a_truncated_bag_says_how_to_repair_it(tmp_path):
    write_texts(tmp_path / 'bag', range(10))
    os.truncate(tmp_path / 'bag/bag_0.mcap', 500)
    with pytest.raises(BagError, match=f"'deck_motion recover {tmp_path / 'bag'}' repairs it"):
        BagReader(tmp_path / 'bag')


@pytest.mark.parametrize('compression', ['none', 'zstd'])
def test_a_flipped_bit_is_an_error_not_a_wrong_number(tmp_path, compression):
    write_texts(tmp_path / 'bag', range(1000), flush_every=500, compression=compression)
    path = tmp_path / 'bag/bag_0.mcap'
    with path.open('rb') as file:
        place = make_reader(file).get_summary().chunk_indexes[1]
    content = bytearray(path.read_bytes())
    content[place.chunk_start_offset + place.chunk_length // 2] ^= 4
    path.write_bytes(content)
    with pytest.raises(BagError, match=f'bag_0.mcap: damaged at byte {place.chunk_start_offset}'):
        list(BagReader(tmp_path / 'bag').messages())


def test_bytes_that_are_no_such_message_are_an_error(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic('/ship/imu', IMU)
        bag.write('/ship/imu', 1, encode(IMU, imu(1, 0.0))[:100])
    reader = BagReader(tmp_path / 'bag')
    with pytest.raises(BagError, match='a message of /ship/imu is damaged'):
        reader.decode(*next((topic, data) for topic, _, data in reader.messages()))


# where nothing may stay, and where everything must


def test_an_existing_folder_is_not_touched(tmp_path):
    (tmp_path / 'bag').mkdir()
    for atomic in (False, True):
        with pytest.raises(BagError, match='bag: already exists'):
            BagWriter(tmp_path / 'bag', atomic=atomic)
    assert os.listdir(tmp_path) == ['bag'] and not os.listdir(tmp_path / 'bag')


def test_a_folder_that_cannot_be_made_leaves_nothing(tmp_path):
    (tmp_path / 'file').touch()
    for atomic in (False, True):
        with pytest.raises(BagError, match='bag: cannot be made: Not a directory'):
            BagWriter(tmp_path / 'file/bag', atomic=atomic)
    assert os.listdir(tmp_path) == ['file']


def test_an_atomic_bag_appears_whole_or_not_at_all(tmp_path):
    with pytest.raises(RuntimeError), BagWriter(tmp_path / 'bag', atomic=True) as bag:
        bag.add_topic('/a', STRING)
        bag.write('/a', 1, text('x'))
        bag.flush()
        assert not (tmp_path / 'bag').exists()
        raise RuntimeError
    assert os.listdir(tmp_path) == []
    write_texts(tmp_path / 'bag', [1], atomic=True)
    assert os.listdir(tmp_path) == ['bag']
    assert sorted(os.listdir(tmp_path / 'bag')) == ['bag_0.mcap', 'metadata.yaml']


def test_a_time_that_cannot_be_is_refused_and_harms_nothing(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic('/a', STRING)
        for times in ((-1, 1), (1, -1), (2**63, 1), (1, 2**70)):
            with pytest.raises(BagError, match='a message of /a has a time before 1970 or after'):
                bag.write('/a', times[0], text('x'), times[1])
        bag.write('/a', 1, text('y'))
    assert BagReader(tmp_path / 'bag').counts == {'/a': 1}


@pytest.fixture
def small_disk():
    """Let no file grow beyond 200 kB, as on a full disk; return what makes room."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, before[1]))

    def make_room():
        resource.setrlimit(resource.RLIMIT_FSIZE, before)

    yield make_room
    make_room()


def test_a_full_disk_ends_writing_and_keeps_what_there_was(tmp_path, small_disk):
    with pytest.raises(BagError, match='bag: cannot be written: File too large; what was written '
                                       "before is safe, 'deck_motion recover .*/bag' opens it"):
        write_texts(tmp_path / 'bag', range(100_000), flush_every=100)
    small_disk()
    recovered = recover(tmp_path / 'bag').messages
    reader = BagReader(tmp_path / 'bag')
    seen = [reader.decode(topic, data).data for topic, _, data in reader.messages()]
    assert seen == [str(k) for k in range(recovered)]
    assert recovered > 200_000 / 80


def test_a_full_disk_leaves_nothing_of_an_atomic_bag(tmp_path, small_disk):
    with pytest.raises(BagError, match='bag: cannot be written: File too large$'):
        write_texts(tmp_path / 'bag', range(100_000), atomic=True)
    assert os.listdir(tmp_path) == []


def test_a_background_writer_tells_of_a_full_disk(tmp_path, small_disk):
    bag = BagWriter(tmp_path / 'bag')
    writer = BackgroundWriter(bag)
    writer.add_topic('/a', STRING, None, ())
    for k in range(10_000):
        writer.write('/a', k, text(str(k)), k)
    writer.close()
    assert 'cannot be written' in str(writer.error)
    assert writer.taken == 10_000
    small_disk()
    assert writer.saved <= recover(tmp_path / 'bag').messages < 10_000


def test_messages_before_the_first_clock_are_held(tmp_path):
    writer = BackgroundWriter(BagWriter(tmp_path / 'bag'))
    writer.add_topic('/a', STRING, None, ())
    writer.hold('/a', 700, text('0'), 1)
    writer.hold('/a', 800, text('1'), 2)
    writer.write('/a', 50, text('2'), 3)
    writer.hold('/a', 900, text('3'), 4)
    writer.close()
    assert [(time, sent, data) for time, _, sent, data in BagReader(tmp_path / 'bag').records()
            ] == [(50, 1, text('0')), (50, 2, text('1')), (50, 3, text('2')), (900, 4, text('3'))]


# repair


@pytest.fixture(scope='module', params=['none', 'zstd', 'lz4'])
def whole(request, tmp_path_factory):
    """Return a whole bag, its texts, and how many of them were safe at which size."""
    folder = tmp_path_factory.mktemp('whole') / 'bag'
    safe = []
    with BagWriter(folder, compression=request.param) as bag:
        bag.add_topic('/a', STRING, qos=[qos()])
        bag.add_topic('/b', STRING)
        for k in range(400):
            bag.write('/ab'[::2] if k % 2 else '/a', k, text(f'{k} ' + 'x' * (k % 40)))
            if k % 50 == 49:
                bag.flush()
                safe.append((bag.size, k + 1))
    return folder, [data for *_, data in BagReader(folder).messages()], safe


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(part=st.floats(0, 1, exclude_max=True))
def test_a_file_cut_anywhere_gives_all_that_came_before(whole, tmp_path, part):
    folder, texts, safe = whole
    shutil.rmtree(tmp_path / 'bag', ignore_errors=True)
    shutil.copytree(folder, tmp_path / 'bag')
    path = tmp_path / 'bag/bag_0.mcap'
    cut = int(part * path.stat().st_size)
    os.truncate(path, cut)
    damaged = path.read_bytes()
    recovered = recover(tmp_path / 'bag')
    assert recovered.messages >= max((count for size, count in safe if size <= cut), default=0)
    with Reader(tmp_path / 'bag') as reader:
        assert [data for *_, data in reader.messages()] == texts[:recovered.messages]
    assert recovered.kept == (path.with_name('bag_0.mcap.damaged'),)
    assert recovered.kept[0].read_bytes() == damaged
    before = path.read_bytes()
    assert recover(tmp_path / 'bag').repaired == () and path.read_bytes() == before


@pytest.mark.parametrize('compression', ['none', 'zstd', 'lz4'])
def test_messages_of_an_unfinished_chunk_are_saved(tmp_path, compression):
    noise = np.random.default_rng(1)
    with BagWriter(tmp_path / 'bag', compression=compression) as bag:
        bag.add_topic('/a', STRING)
        for k in range(500):
            bag.write('/a', k, noise.bytes(1000))
    path = tmp_path / 'bag/bag_0.mcap'
    os.truncate(path, 300_000)
    assert 120 < recover(tmp_path / 'bag').messages < 300


def test_repair_keeps_types_and_quality_of_service(whole, tmp_path):
    folder, _, safe = whole
    shutil.copytree(folder, tmp_path / 'bag')
    os.truncate(tmp_path / 'bag/bag_0.mcap', safe[2][0])
    recover(tmp_path / 'bag')
    assert BagReader(tmp_path / 'bag').bag_topics == BagReader(folder).bag_topics
    assert description(tmp_path / 'bag')['message_count'] == safe[2][1]


def test_a_killed_recorder_that_had_split_its_bag(tmp_path):
    contents = write_texts(tmp_path / 'bag', range(0, 12 * SECOND, SECOND), max_duration=1.0)
    (tmp_path / 'bag/metadata.yaml').unlink()
    last = tmp_path / 'bag/bag_11.mcap'
    os.truncate(last, last.stat().st_size - 20)
    first = (tmp_path / 'bag/bag_0.mcap').read_bytes()
    assert recover(tmp_path / 'bag').repaired == (last,)
    assert (tmp_path / 'bag/bag_0.mcap').read_bytes() == first
    assert description(tmp_path / 'bag')['relative_file_paths'] == [
        f'bag_{k}.mcap' for k in range(12)]
    assert [data for *_, data in BagReader(tmp_path / 'bag').messages()] == contents


def test_only_the_description_is_missing(tmp_path):
    contents = write_texts(tmp_path / 'bag', range(10))
    before = (tmp_path / 'bag/metadata.yaml').read_bytes()
    (tmp_path / 'bag/metadata.yaml').unlink()
    assert [data for *_, data in BagReader(tmp_path / 'bag').messages()] == contents
    recovered = recover(tmp_path / 'bag')
    assert recovered.repaired == () and 'topics; metadata.yaml written' in str(recovered)
    assert (tmp_path / 'bag/metadata.yaml').read_bytes() == before
    (tmp_path / 'bag/metadata.yaml').write_text('rosbag2_bagfile_information: [')
    recover(tmp_path / 'bag')
    assert (tmp_path / 'bag/metadata.yaml').read_bytes() == before


def test_one_file_by_itself(tmp_path):
    contents = write_texts(tmp_path / 'bag', range(10))
    path = (tmp_path / 'bag/bag_0.mcap').rename(tmp_path / 'lone.mcap')
    assert [data for *_, data in BagReader(path).messages()] == contents
    os.truncate(path, path.stat().st_size - 1)
    assert recover(path).messages == 10
    assert [data for *_, data in BagReader(path).messages()] == contents
    assert sorted(os.listdir(tmp_path)) == ['bag', 'lone.mcap', 'lone.mcap.damaged']


def test_a_repair_that_died_is_taken_up_again(whole, tmp_path):
    folder, texts, safe = whole
    shutil.copytree(folder, tmp_path / 'bag')
    path = tmp_path / 'bag/bag_0.mcap'
    os.truncate(path, safe[-1][0])
    path.rename(path.with_name('bag_0.mcap.damaged'))
    for half_written in (False, True):
        if half_written:
            path.write_bytes(path.read_bytes()[:200])
        assert recover(tmp_path / 'bag').messages == len(texts)


def test_a_damaged_chunk_does_not_cost_the_others(whole, tmp_path):
    folder, _, safe = whole
    shutil.copytree(folder, tmp_path / 'bag')
    path = tmp_path / 'bag/bag_0.mcap'
    content = bytearray(path.read_bytes())
    content[safe[2][0] + 150] ^= 1  # inside the fourth chunk
    path.write_bytes(content[:-5])
    assert recover(tmp_path / 'bag').messages == 350
    assert 'nothing to repair' in str(recover(tmp_path / 'bag'))


def test_a_damaged_chunk_of_a_whole_file_is_repaired_as_its_error_says(whole, tmp_path):
    folder, _, safe = whole
    shutil.copytree(folder, tmp_path / 'bag')
    path = tmp_path / 'bag/bag_0.mcap'
    content = bytearray(path.read_bytes())
    content[safe[2][0] + 150] ^= 1
    path.write_bytes(content)
    with pytest.raises(BagError, match=f"'deck_motion recover {tmp_path / 'bag'}' saves the rest"):
        list(BagReader(tmp_path / 'bag').messages())
    assert recover(tmp_path / 'bag').messages == 350
    assert len(list(BagReader(tmp_path / 'bag').messages())) == 350


@pytest.mark.parametrize('make, words', [
    (lambda path: None, 'does not exist'),
    (lambda path: path.mkdir(), 'no MCAP file here'),
    (lambda path: (path.mkdir(), (path / 'x_0.mcap').write_text('no bag')), 'not an MCAP file'),
])
def test_what_cannot_be_repaired_is_named(tmp_path, make, words):
    make(tmp_path / 'bag')
    before = sorted(tmp_path.rglob('*'))
    with pytest.raises(BagError, match=words):
        recover(tmp_path / 'bag')
    assert sorted(tmp_path.rglob('*')) == before


def test_a_repair_without_room_changes_nothing(tmp_path):
    write_texts(tmp_path / 'bag', range(5000), compression='zstd')  # small, but large unpacked
    path = tmp_path / 'bag/bag_0.mcap'
    os.truncate(path, path.stat().st_size - 3)
    before = path.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) // 2, limits[1]))
    try:
        with pytest.raises(BagError, match='cannot be repaired: File too large'):
            recover(tmp_path / 'bag')
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert path.read_bytes() == before and len(os.listdir(tmp_path / 'bag')) == 2


# what the nodes leave to this room


@pytest.mark.parametrize('choice, chosen', [
    (TopicChoice(), ['/ship/imu', '/ship/heave', '/rosout']),
    (TopicChoice(['/rosout']), ['/rosout']),
    (TopicChoice(['/rosout'], 'imu$'), ['/ship/imu', '/rosout']),
    (TopicChoice(pattern='ship', exclude='heave'), ['/ship/imu']),
    (TopicChoice(exclude='^/ship'), ['/rosout']),
    (TopicChoice(['/a/_hidden']), ['/a/_hidden']),
])
def test_topics_by_list_by_pattern_or_all(choice, chosen):
    names = ['/ship/imu', '/ship/heave', '/rosout', '/a/_hidden']
    assert [name for name in names if name in choice] == chosen


def test_a_wrong_pattern_is_named():
    with pytest.raises(ValueError, match="parameter 'exclude' is not a regular expression"):
        TopicChoice(exclude='ship(')


def test_missing_messages_are_counted_where_there_is_one_publisher():
    gaps = SequenceGaps()
    for number in (5, 6, 9, 10):
        gaps.note('/one', number)
    for number in (1, 2, 500, 3):
        gaps.note('/two', number)
    gaps.note('/none', None)
    assert gaps.missing == {'/one': 2}


@pytest.mark.parametrize('offers, request_, mixed', [
    ([qos()], 'RELIABLE VOLATILE', False),
    ([qos('BEST_EFFORT')], 'BEST_EFFORT VOLATILE', False),
    ([qos(durability='TRANSIENT_LOCAL')] * 2, 'RELIABLE TRANSIENT_LOCAL', False),
    ([qos(), qos('BEST_EFFORT')], 'BEST_EFFORT VOLATILE', True),
    ([qos(), qos(durability='TRANSIENT_LOCAL')], 'RELIABLE VOLATILE', True),
])
def test_a_request_fits_every_publisher(offers, request_, mixed):
    reliability, durability, differ = fitting_request(offers)
    assert f'{reliability.name} {durability.name}' == request_ and differ is mixed


def test_an_offer_is_what_all_recorded_publishers_offered():
    assert fitting_offer([]) is None
    assert fitting_offer([qos(), qos('BEST_EFFORT')]) is None
    assert fitting_offer([qos(depth=3), qos(depth=5)]) == qos(depth=3)


@pytest.fixture
def ten_seconds(tmp_path):
    write_texts(tmp_path / 'bag', [100 * SECOND + k * SECOND // 10 for k in range(101)])
    return BagReader(tmp_path / 'bag')


def test_a_schedule_counts_from_the_start(ten_seconds):
    plan = list(schedule(ten_seconds, ['/a'], PlayerConfig(rate=4.0, start=2.05)))
    assert [event.time for event in plan] == [102_100_000_000 + k * SECOND // 10
                                              for k in range(80)]
    assert [event.due for event in plan] == [k * SECOND // 40 for k in range(80)]


def test_a_schedule_as_fast_as_possible_keeps_a_pace(ten_seconds):
    plan = list(schedule(ten_seconds, ['/a'], PlayerConfig(rate=0.0, max_rate=1000.0)))
    assert [event.due for event in plan] == [k * 1_000_000 for k in range(101)]


@pytest.mark.parametrize('rate, passes', [(2.0, 5 * SECOND), (0.0, 101 * SECOND // 2000)])
def test_a_loop_goes_on_where_the_last_pass_ended(ten_seconds, rate, passes):
    events = schedule(ten_seconds, ['/a'], PlayerConfig(rate=rate, loop=True))
    plan = [next(events) for _ in range(303)]
    assert [event.data for event in plan] == [text(str(k)) for k in range(101)] * 3
    assert [plan[101 * k].due for k in range(3)] == [k * passes for k in range(3)]
    assert all(one.due <= two.due for one, two in zip(plan, plan[1:], strict=False))


def test_ticks_of_the_clock_come_before_the_messages_of_their_time(ten_seconds):
    plan = list(schedule(ten_seconds, ['/a'], PlayerConfig(clock=4.0)))
    ticks = [event.time for event in plan if not event.topic]
    assert ticks == [100 * SECOND + k * SECOND // 4 for k in range(41)]
    assert [event.time for event in plan] == sorted(event.time for event in plan)
    assert [plan[0].topic, plan[1].topic] == ['', '/a']


def test_a_start_beyond_the_end_is_named(ten_seconds):
    with pytest.raises(BagError, match="'start' is 11 s, the bag is 10 s long"):
        next(schedule(ten_seconds, ['/a'], PlayerConfig(start=11.0)))
