"""What an artist reads and presses in the sidebar: panels, lists, menus, presets. Changes nothing by itself. Imports
every other room.
"""
