"""The desk: compare, add effects, fit and save by hand, in a browser."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from dovetail.desk.figures import curve_changes, moved_map
    from dovetail.desk.jobs import Job, Newest
    from dovetail.desk.journal import JournalError, journal_of, read_journal, write_journal
    from dovetail.desk.saving import by_hand, held_out_of, live_model, save_study, write_desk_report
    from dovetail.desk.scale import Scale
    from dovetail.desk.serve import HOST, Guard, MissingDeskError, free_port, require_nicegui, tells, wait_for
    from dovetail.desk.session import Desk
    from dovetail.desk.state import MOST_STATES, DeskState, History, Stair
    from dovetail.desk.views import VIEWS, Chosen, frequency_bars
else:
    __getattr__, __dir__ = names_on_use(__name__)
