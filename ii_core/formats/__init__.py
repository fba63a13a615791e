"""Light-field formats: folders of views, the HCI layout, quilts, lenslet mosaics; readers and writers.

A view of a light field is a sub-image here. In camera order, row by row from the top left camera, view (row, column)
is SI_{u,v} with u = column and v = row: seen from before the display, the pixel further to the right under a lens
belongs to the viewer further to the right. In a picture of erect elementary images it is the other way about.

============  ==================================================================================================
layout        what it is
============  ==================================================================================================
views         a folder of pictures with two numbers in their names, any names: ``view_03_12.png``,
              ``IMG_0001_033_04_08.png``, ``out_03_12_-381.9_1103.4.png`` (Stanford, with the places of cameras).
              These places or the pictures tell which number runs across, and which way (`order.Arrangement`)
HCI           ``input_Cam000.png`` … row by row from the top left camera, the grid in ``parameters.cfg``
quilt         ``name_qsCxRaA.png``: C×R tiles of views along one line, the leftmost at the bottom left, rows upward;
              what does not divide by C and R is cut off at the right and the top
mosaic        the II-picture itself, U×V pixels under each lens
============  ==================================================================================================

References
----------
K. Honauer et al., "A dataset and evaluation methodology for depth estimation on 4D light fields", 2016 (HCI).
"""
