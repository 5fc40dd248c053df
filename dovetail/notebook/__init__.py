"""What a notebook shows of a study: tables in HTML, labelled arrays, and figures of comparisons."""
