"""How often each fact of a report came out so, in true reports at their places and in controls.

Written by ``lab/fit_support.py``, measured on FARS reports of Virginia 2023 and of Arizona, California, Ohio and
South Dakota 2012 to 2016. A module and no file beside, so that a verdict's fingerprint covers it.
"""

COUNTS = """\
fact,agreement,true_count,true_of,chance_count,chance_of
alignment,agrees,120,137,43,68
alignment,near,10,137,18,68
alignment,differs,7,137,7,68
carriageways,agrees,31,31,11,14
carriageways,differs,0,31,3,14
compass direction,agrees,2,2,1,4
compass direction,differs,0,2,3,4
control,agrees,92,99,38,44
control,differs,7,99,6,44
course of the person,agrees,7,7,12,49
course of the person,differs,0,7,37,49
crash type,agrees,174,176,684,2738
crash type,differs,2,176,2054,2738
critical event,agrees,80,83,569,1463
critical event,differs,3,83,894,1463
crosswalk,agrees,4,4,0,1
crosswalk,differs,0,4,1,1
damage,agrees,64,69,874,1273
damage,near,5,69,180,1273
damage,differs,0,69,219,1273
division,agrees,99,103,31,48
division,differs,4,103,17,48
first harmful event,agrees,93,93,1426,1426
first street,agrees,148,154,7,29
first street,near,2,154,4,29
first street,differs,4,154,18,29
impact,agrees,137,181,883,2757
impact,near,44,181,1001,2757
impact,differs,0,181,873,2757
impact of the object,agrees,25,44,173,549
impact of the object,near,19,44,262,549
impact of the object,differs,0,44,114,549
impact of the strike,agrees,44,44,420,621
impact of the strike,near,0,44,123,621
impact of the strike,differs,0,44,78,621
intersection,agrees,182,198,54,97
intersection,near,8,198,3,97
intersection,differs,8,198,40,97
land use,agrees,151,184,61,94
land use,near,9,184,5,94
land use,differs,24,184,28,94
lanes,agrees,123,140,37,63
lanes,differs,17,140,26,63
limit,agrees,73,87,13,44
limit,differs,14,87,31,44
manner of collision,agrees,89,89,831,1363
manner of collision,differs,0,89,532,1363
movement,agrees,108,108,1460,1914
movement,differs,0,108,454,1914
movement before the departure,agrees,21,21,160,177
movement before the departure,differs,0,21,17,177
movement before the strike,agrees,24,24,253,322
movement before the strike,differs,0,24,69,322
part of the road,agrees,64,64,725,771
part of the road,differs,0,64,46,771
point,agrees,161,198,75,97
point,near,30,198,19,97
point,differs,7,198,3,97
road class,agrees,125,187,34,86
road class,near,47,187,24,86
road class,differs,15,187,28,86
second street,agrees,64,68,1,26
second street,near,1,68,1,26
second street,differs,3,68,24,26
side of the departure,agrees,59,60,342,750
side of the departure,differs,1,60,408,750
speed before the departure,agrees,35,35,78,441
speed before the departure,differs,0,35,363,441
speed before the strike,agrees,33,33,68,463
speed before the strike,differs,0,33,395,463
striking vehicle,agrees,41,41,617,617
travel speed,agrees,149,149,323,2377
travel speed,differs,0,149,2054,2377
zone of the person,agrees,41,41,596,617
zone of the person,differs,0,41,21,617
"""
