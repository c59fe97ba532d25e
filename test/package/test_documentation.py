"""The interface document against the tables it is made from."""

import re

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


def test_links_in_documents_lead_somewhere(project):
    documents = [path for folder in ('.', 'doc', 'doc/decisions', 'bags')
                 for path in (project / folder).glob('*.md')]
    assert len(documents) > 5
    for path in documents:
        for link in re.findall(r'\]\(([^)#:]+)\)', path.read_text(encoding='utf-8')):
            assert (path.parent / link).exists(), f'{path}: {link}'


def test_every_decision_is_listed(project):
    folder = project / 'doc/decisions'
    listed = re.findall(r'\((\d{4}-.*?\.md)\)', (folder / 'README.md').read_text(encoding='utf-8'))
    assert listed == sorted(path.name for path in folder.glob('[0-9]*.md'))
