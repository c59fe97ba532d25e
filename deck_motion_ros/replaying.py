"""Run a node's estimator over a bag, without ROS and as fast as the disk allows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deck_motion_ros.config import configured, unknown_names
from deck_motion_ros.messages import diagnostics_message
from deck_motion_ros.names import absolute, remappings
from deck_motion_ros.pipelines import PIPELINES
from deck_motion_ros.recording import BagError, BagReader, BagTypes, BagWriter, encode
from deck_motion_ros.samples import NANOSECONDS
from deck_motion_ros.topics import BY_NAME, DIAGNOSTICS, inputs, outputs


@dataclass(frozen=True)
class Replayed:
    """
    What a replay did.

    Attributes
    ----------
    inputs, outputs : int
        Messages used and made.
    seconds : float
        Length of the bag.

    """

    inputs: int
    outputs: int
    seconds: float


def replay(in_bag: Path, out_bag: Path, node: str, params: Mapping[str, Any], *,
           remap: Sequence[str] = (), namespace: str = '/',
           warn: Callable[[str], None] = lambda text: None,
           progress: Callable[[float], None] = lambda fraction: None) -> Replayed:
    """
    Replay a bag through one node's estimator.

    The messages act in the order of their log time, as they would arrive; the numbers are those
    of the live node for that order, bit for bit.

    Parameters
    ----------
    in_bag, out_bag : Path
        ``out_bag`` gets everything of ``in_bag`` except what this node or another's diagnostics
        said, and the outputs of the node, each at the log time of the message that caused it;
        ``/diagnostics`` once a second. It appears only when complete.
    node : str
        Name in ``PIPELINES``.
    params : mapping
        Parameters by name.
    remap : sequence of str
        Rules ``old:=new`` for the node's topics.
    namespace : str
        Of the node.
    warn, progress : callable
        Take the node's warnings and the fraction that is done.

    Raises
    ------
    ValueError
        If a parameter or a rule is wrong, a bag cannot be read or written, or the bag has none
        of the node's input topics.

    """
    kind = PIPELINES[node]
    for name in unknown_names(kind.config_class, params):
        warn(f"unknown parameter '{name}' ignored")
    known = {name: value for name, value in params.items()
             if name not in unknown_names(kind.config_class, params) and name != 'use_sim_time'
             and not name.startswith('qos_overrides.')}
    types = BagTypes()
    pipeline = kind(configured(kind.config_class, known), types, warn)
    rules = remappings(remap, namespace)

    def resolved(name: str) -> str:
        full = absolute(name, namespace)
        return rules.get(full, full)

    reader = BagReader(in_bag)
    sources = {resolved(topic.name): topic for topic in inputs(node)}
    _check_inputs(reader, sources, in_bag)
    sinks = {topic.name: resolved(topic.name) for topic in outputs(node)}
    dropped = {*sinks.values(), '/diagnostics'}
    copied = [topic for name, topic in reader.bag_topics.items() if name not in dropped]
    hardware_id = absolute(node, namespace)
    made = used = 0
    start, next_report = reader.start, reader.start
    length = max(reader.end - start, 1)
    with BagWriter(out_bag, atomic=True, compression='zstd') as writer:
        for topic in copied:
            writer.add(topic)
        for name, sink in sinks.items():
            writer.add_topic(sink, BY_NAME[name].type)
        writer.add_topic('/diagnostics', DIAGNOSTICS)

        def report(now: int) -> None:
            msg = diagnostics_message(types, now, hardware_id, pipeline.diagnostics())
            writer.write('/diagnostics', now, encode(DIAGNOSTICS, msg))

        now = start
        for name, now, data in reader.messages([topic.name for topic in copied]):
            writer.write(name, now, data)
            source = sources.get(name)
            if source is not None:
                used += 1
                for out_name, msg in pipeline.take(source.name, reader.decode(name, data)):
                    writer.write(sinks[out_name], now, encode(BY_NAME[out_name].type, msg))
                    made += 1
            if now >= next_report:
                report(now)
                progress((now - start) / length)
                next_report = now + NANOSECONDS
        report(now)
    if not made:
        warn(f'{node} has published nothing: {pipeline.diagnostics()[0][2]}')
    pipeline.close()
    progress(1.0)
    return Replayed(used, made, length / NANOSECONDS)


def _check_inputs(reader: BagReader, sources: Mapping[str, Any], in_bag: Path) -> None:
    found = [name for name in sources if name in reader.topics]
    if not found:
        raise BagError(f"{in_bag}: holds none of {', '.join(sources)}; it has "
                       f"{', '.join(sorted(reader.topics))}")
    for name in found:
        if reader.topics[name] != sources[name].type:
            raise BagError(f'{in_bag}: {name} is {reader.topics[name]}, '
                           f'not {sources[name].type}')
