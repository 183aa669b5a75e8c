"""A map as a page: look into it, see and hear the motion of any cell.

Read `explored` and `unpacked` (a map, read plane by plane), `cells` (a cell as a scene), `content`
(what is shown of a motion), `motion_panel`, `map_panel` and `overlay` (where it is shown), `page`
(what a click does), `worker` (who computes), `box` (a part of the map, finer), `server` (who is
served). Nothing here trusts a map: sizes are checked before they are read, and its words are shown
as text.
"""
