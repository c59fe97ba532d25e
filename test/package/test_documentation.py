"""The interface document against the tables it is made from."""

from deck_motion_ros.config import parameters
from deck_motion_ros.documentation import CONFIGS, interfaces
from deck_motion_ros.topics import TOPICS


def test_interfaces_document_is_up_to_date(project):
    written = (project / 'doc/interfaces.md').read_text(encoding='utf-8')
    assert written == interfaces(), 'run: make docs'


def test_every_topic_and_parameter_is_in_it():
    text = interfaces()
    for topic in TOPICS:
        assert f'| `{topic.name}` |' in text
    for kind in CONFIGS.values():
        for name in parameters(kind):
            assert f'| `{name}` |' in text


def test_tables_are_rectangular():
    rows = [line.replace('\\|', '') for line in interfaces().splitlines() if line[:1] == '|']
    assert {row.count('|') for row in rows} == {6, 7}


def test_topics_go_between_nodes_that_exist():
    for topic in TOPICS:
        assert set(topic.subscribers) <= set(CONFIGS)
        assert topic.publisher in {*CONFIGS, '', 'every node'}


def test_every_parameter_has_meaning_and_valid_default():
    for kind in CONFIGS.values():
        for rule in parameters(kind).values():
            assert rule.meaning, rule.name
            rule.check(rule.default)
