"""The report of a run: words, pictures and one HTML page."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from dovetail.report.blocks import TableBlock
    from dovetail.report.drawings import Album, Figures, packed
    from dovetail.report.drawn import compared_models, fits_of, marked_places, pair_errors, rivals
    from dovetail.report.figures import magnitude_title, make_all, sizes
    from dovetail.report.outline import OutlinePicture, read_outline
    from dovetail.report.page import Markup, html, join, report_page, tag
    from dovetail.report.pictures import draw_all
    from dovetail.report.probable import label_of, probability_details, probability_text
    from dovetail.report.report import report_html
    from dovetail.report.sections.assumptions import thresholds
    from dovetail.report.sections.mode_shapes import mode_heading, partner_shapes, quadrature_shapes
    from dovetail.report.shown import Shown
    from dovetail.report.table import Column, Table, write_csv, write_xlsx
    from dovetail.report.words import departure_text, fitted_text, headline, parameter_text
else:
    __getattr__, __dir__ = names_on_use(__name__)
