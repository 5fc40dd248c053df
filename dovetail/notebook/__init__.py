"""Views of a study in a notebook: tables in HTML, labelled arrays, and figures of comparisons."""
