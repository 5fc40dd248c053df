"""A run of the bent frame with a hidden mass, which tests of all that shows a result read."""

from dataclasses import replace

import pytest


@pytest.fixture
def all_digits(monkeypatch):
    """Let studies have all digits of fitted values, so that models can be compared to rounding errors."""
    monkeypatch.setattr("dovetail.file.toml.FITTED_DIGITS", 17)


@pytest.fixture(scope="session")
def bent_file(tmp_path_factory):
    """Return the study file of the bent frame; tests write nothing into its folder."""
    from tests.frames import write_study

    return write_study(tmp_path_factory.mktemp("bent"))


@pytest.fixture(scope="session")
def bent_and_album(bent_file, tmp_path_factory):
    """Return a run and its pictures, of which none is of the structure: these take longer than the rest."""
    from dovetail import load_study, pipeline
    from dovetail.report import pictures

    draw_all, drawn = pictures.draw_all, []

    def keep(*call):
        drawn.append(draw_all(*call))
        return drawn[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pictures, "can_draw", lambda: False)
        patch.setattr(pictures, "draw_all", keep)
        done = pipeline.run(load_study(bent_file), tmp_path_factory.mktemp("run") / "out")
    (album,) = drawn
    folder = done.folder / "pictures"
    moved = {name: replace(p, file=folder / p.file.name) for name, p in album.pictures.items()}
    return done, replace(album, folder=folder, pictures=moved)


@pytest.fixture(scope="session")
def bent(bent_and_album):
    """Return a run of the bent frame: its study, diagnosis and files."""
    return bent_and_album[0]


@pytest.fixture(scope="session")
def bent_album(bent_and_album):
    """Return the pictures of the run of the bent frame."""
    return bent_and_album[1]
