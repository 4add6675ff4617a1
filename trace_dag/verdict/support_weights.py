"""How often each fact of a report came out so, in true reports at their places and in controls.

Written by ``benchmarks/fit_support.py``, measured on FARS reports of Virginia 2023 and of Arizona, California, Ohio and
South Dakota 2012 to 2016. A module and no file beside, so that a verdict's fingerprint covers it.
"""

COUNTS = """\
fact,agreement,true_count,true_of,chance_count,chance_of
alignment,agrees,31,38,137,218
alignment,near,4,38,43,218
alignment,differs,3,38,38,218
carriageways,agrees,3,3,9,20
carriageways,differs,0,3,11,20
control,agrees,18,21,94,109
control,differs,3,21,15,109
crash type,agrees,62,62,282,1211
crash type,differs,0,62,929,1211
critical event,agrees,31,34,254,628
critical event,differs,3,34,374,628
damage,agrees,23,25,357,549
damage,near,1,25,106,549
damage,differs,1,25,86,549
division,agrees,19,21,77,127
division,differs,2,21,50,127
first harmful event,agrees,32,32,604,640
first harmful event,differs,0,32,36,640
first street,agrees,20,20,4,131
first street,near,0,20,5,131
first street,differs,0,20,122,131
impact,agrees,45,62,325,1257
impact,near,17,62,488,1257
impact,differs,0,62,444,1257
intersection,agrees,29,32,114,210
intersection,near,3,32,25,210
intersection,differs,0,32,71,210
land use,agrees,26,31,132,203
land use,near,3,31,13,203
land use,differs,2,31,58,203
lanes,agrees,24,28,80,133
lanes,differs,4,28,53,133
limit,agrees,15,17,29,82
limit,differs,2,17,53,82
manner of collision,agrees,31,31,381,599
manner of collision,differs,0,31,218,599
movement,agrees,44,44,649,865
movement,differs,0,44,216,865
point,agrees,27,32,189,210
point,near,5,32,13,210
point,differs,0,32,8,210
road class,agrees,23,32,63,204
road class,near,7,32,52,204
road class,differs,2,32,89,204
second street,agrees,13,14,7,101
second street,differs,1,14,94,101
travel speed,agrees,59,59,136,1082
travel speed,differs,0,59,946,1082
"""
